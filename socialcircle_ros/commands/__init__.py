# SPDX-License-Identifier: Apache-2.0
"""The commands of `socialcircle`: options, printing and exit codes. The work is done in the other rooms."""

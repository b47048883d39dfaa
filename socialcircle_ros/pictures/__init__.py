# SPDX-License-Identifier: Apache-2.0
"""Pictures of clouds in one style, for reports, the demo, the documents and the experiments. No pages."""

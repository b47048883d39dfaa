# SPDX-License-Identifier: Apache-2.0
"""The network of the adaptive mode: corpus, training, export, and its comparison with the rules of that mode.

The product does not need this room, and nothing in it is imported by the product. `python -m
socialcircle_ros.studies.learned` makes the corpus and trains; `socialcircle experiment learned` compares.
`docs/learned.md` has the definition, the model card and what was measured.
"""

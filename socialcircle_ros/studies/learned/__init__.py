"""The network that judges touch: corpus, training and export.

The product does not need this room, and nothing in it is imported by the product. `python -m
socialcircle_ros.studies.learned` makes the corpus and trains. `docs/learned.md` has the definition and the model
card.
"""

# SPDX-License-Identifier: Apache-2.0
"""Teaching: a lesson about one kind of part, from clouds of good parts.

- `clouds`: the good clouds, and the fields to teach on and to check on.
- `residuals`: how far points stand off their surroundings, and where edges are.
- `examples`: outliers put into fields, and the communities that the rules then find.
- `fit`: the logistic function that tells them apart.
- `learn`: the lesson from all of these.
- `teach`: all of it, with the check.
- `page`: what the check found, as an HTML page.

How a lesson judges is in `circle.adaptive.lesson`, its file in `settings.lessons`.
"""

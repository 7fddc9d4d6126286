"""Scores against known truth: what was found of a motion, and how it looks from views never seen.

`truth.py` and `truth_scene.py` read a scene, `methods.py` and `tasks.py` say what is done with it,
`fits.py` does it, `motion_scores.py` and `image_scores.py` judge the result, `table.py`,
`json_table.py`, `pictures.py` and `error_plot.py` show it. The layout of a scene with truth stands
in docs/evaluation.md. No stage of the method knows this package.
"""

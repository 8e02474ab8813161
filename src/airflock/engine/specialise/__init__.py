"""Specialise: from a stage, a plain Python function, to the statements of one plan's driver.

What depends on the plan alone is evaluated while the statements are made: tests choose a branch,
loops over axes and fields are unrolled, a rule is called with the arguments that it takes. The rest
is copied. Each expression is evaluated once (`specialiser`): its value is either known, a Python
object, or a syntax tree of the driver.
"""

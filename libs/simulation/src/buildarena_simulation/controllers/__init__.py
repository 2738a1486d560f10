"""Controllers: programs that sense and act at every tick of a trial.

`program` runs a stranger's Lua within bounds and knows nothing of machines; `senses` makes what it
is told, `answers` reads what it asks for, `pilot` joins the three in a trial. Engines know none.
"""

"""Controllers: programs that sense and act at every tick of a trial.

`program` runs untrusted Lua within limits, independently of machines; `senses` produces its input,
`answers` interprets its output, `pilot` joins the three in a trial. Engines are independent of
them.
"""

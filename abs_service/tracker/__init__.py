"""Analysis by synthesis: deform, synthesise, compare, search. Pure mathematics; no I/O, no clock, no thread."""

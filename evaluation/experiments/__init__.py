"""What `abs-service evaluate` runs, one experiment per module.

An experiment is a module, or a package, with

    TITLE: str                                                  what it asks, on one line: "E1: ten geometries …"
    Settings                                                    frozen dataclass, its defaults the full evaluation
    QUICK: Settings                                             the same in seconds
    def run(settings: Settings, context: Context) -> Findings   of `evaluation.experiments.base`
"""

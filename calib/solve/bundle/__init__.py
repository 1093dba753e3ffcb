"""Bundle adjustment: parameters, equations, solver."""

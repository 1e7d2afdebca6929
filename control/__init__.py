"""Control mathematics: problems, solver, controllers, estimators, models, references, margins."""

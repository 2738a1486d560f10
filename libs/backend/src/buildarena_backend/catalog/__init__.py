"""The catalogue of names for submissions: models, prompts, workflows, tracks, tasks."""

"""What a submission can name: models, prompts, workflows, tracks, tasks."""

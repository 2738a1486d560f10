"""What runners, the simulation workers that reach only this API, are served by."""

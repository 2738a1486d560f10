"""Services for runners, the simulation workers that reach only this API."""

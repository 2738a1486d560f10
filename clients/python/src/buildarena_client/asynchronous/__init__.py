"""The client on httpx; all but its wire is made of the synchronous one by `make openapi`."""

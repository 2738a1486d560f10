"""A published site: the dashboard's pages with the answers they need, as files."""

"""The dashboard: pages that were built beforehand, served from memory."""

"""The engines behind one seam, a folder each; each is imported only when a trial asks for it."""

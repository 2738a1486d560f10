"""The machine as a structure: parts, clusters, joint loads and breaking; free of any engine."""

"""OpenAI's chat completions, the protocol of most providers."""

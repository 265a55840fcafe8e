"""Match exposure: gains per layer and channel, and shading."""

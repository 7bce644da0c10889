"""A live run for Foxglove: its WebSocket protocol on loopback, by the optional package foxglove-sdk."""

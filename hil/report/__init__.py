"""The post-flight report: one HTML file of a run, of two side by side, or of a campaign. Entry point: `page.py`."""

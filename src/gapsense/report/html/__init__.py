"""Results as one HTML file that needs no server and no network: what ran, how it is wired, plots, metrics, tubes."""

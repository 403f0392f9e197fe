"""Pictures of garments in a report: renderings of roll-outs, each a function as reports.figures has them."""

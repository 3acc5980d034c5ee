"""A local page of a cell's runs, with single samples, and results without some of them."""

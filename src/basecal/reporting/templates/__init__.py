"""Templates, styles and scripts of the pages, and how they are filled in."""

"""What every import does: rows that were read are paired with samples, and complete a cell and its recording."""

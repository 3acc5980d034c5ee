"""What every exporter needs: which transforms, with how many digits, and what they were made from."""

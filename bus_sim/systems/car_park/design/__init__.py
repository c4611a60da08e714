"""How many robots, lifts and compartments a demand needs: a fast model searches, the plant has the last word."""

"""Pick-up and delivery: plant, picture and run on the bus, and the robots' decisions alone, step by step."""

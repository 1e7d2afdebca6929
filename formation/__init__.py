"""The formation, without clock: the formation law, who follows whom, places, limits, succession."""

"""Colours of lines and states that differ for red-green blind readers, too: Okabe and Ito (2008), with three others."""

WHITE = (1.0, 1.0, 1.0, 1.0)
YELLOW = (0.94, 0.89, 0.26, 1.0)
GREEN = (0.0, 0.62, 0.45, 1.0)
SKY = (0.34, 0.71, 0.91, 1.0)
VERMILLION = (0.84, 0.37, 0.0, 1.0)
VIOLET = (0.4, 0.3, 1.0, 1.0)
PINK = (1.0, 0.2, 0.8, 1.0)  # of marks over everything

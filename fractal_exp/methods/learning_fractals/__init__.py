"""Learning Fractals by Gradient Descent (Tu et al., AAAI 2023), on canvases of 32² and 256² pixels."""

"""Indices of a camera row, (DIM,) float64, made by `Camera.row`."""

FX, FY, CX, CY, WIDTH, HEIGHT = 0, 1, 2, 3, 4, 5  # px
OFFSET_X, OFFSET_Y, OFFSET_Z = 6, 7, 8  # m, body FLU
TILT = 9  # rad, positive looks down
MARGIN = 10  # px, a tag's corners must be this far inside the picture
MAX_RANGE = 11  # m
MIN_COS_INCIDENCE = 12  # cosine of the largest incidence angle at which tags decode
MIN_MODULE = 13  # px, smallest foreshortened tag module (bit cell) that decodes
TAGS = 14  # number of tags on the board
FIRST_TAG = 15  # TAG_DIM numbers for each tag
TAG_X, TAG_Y, TAG_HALF, TAG_DIM = 0, 1, 2, 3  # from a tag's first number: centre, half the width; m, board frame
MOST_TAGS = 16
DIM = FIRST_TAG + TAG_DIM * MOST_TAGS

"""Pictures from elsewhere: sets that no renderer of this project drew, and how well codes are found on them."""

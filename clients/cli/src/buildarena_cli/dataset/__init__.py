"""Jobs as a dataset: Parquet with a card, for training and for the analysis of errors."""

"""Requirements of a study, proved or refuted over the whole region and for every machine within tolerance."""

"""What several benchmarks use: options, figures and baselines, measures, readers and peers."""

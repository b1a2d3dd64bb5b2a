"""The public benchmark: methods run on it by us, results that others send, and the scores of both.

benchmark_collection  The datasets of a benchmark, which `simgen benchmark make` makes, by half.
benchmark_jobs        The work of scoring a method on a benchmark: rows, pictures, bounds.
benchmark_page        One page of all submissions in a folder: ranks, lines over light, best and worst scenes,
                      and commands.
submission_checks     What is in a folder of results that were made elsewhere, and its faults.
submission_pictures   Small pictures of results beside the truth, by which one sees what the scores mean.
submission_scores     Scores of a method, run here, or of maps that were made elsewhere.
submitted_maps        Maps of depth and masks of a submission: where they are, checked as they are read.
"""

"""Public benchmarks: collections that one file fixes once and for all, made anywhere, and certified.

benchmark_datasets  The datasets of a benchmark, in order: of each scene its photons by seed, binary frames,
                    and full light.
certificate         Whether the datasets of a benchmark are those that were published: the same bytes, or the
                    same light.
definition          What a benchmark is: its scenes, each of a kind and in one half, its amounts of light, and
                    its seeds.
making              Making a benchmark: all of its datasets as one collection, and the certificate of what
                    they are.
reference_method    Scores of a simple method: whether photons of other bytes are as hard as those published.
"""

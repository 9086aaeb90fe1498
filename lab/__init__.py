"""Work on the package that no user needs: experiments, benchmarks, tools, fits of shipped files."""

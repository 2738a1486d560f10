"""What several scorers measure on a trial: who bears what, what is joined, what wheels drive."""

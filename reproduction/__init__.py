"""The paper, reproduced: each figure and table as an exhibit, beside what the paper states."""

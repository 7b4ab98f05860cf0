//! Confidence intervals, receiver operating characteristics, Pareto fronts.

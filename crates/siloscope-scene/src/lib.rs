//! Ray-casts depth frames of silos with exact truth.

//! What every method reports: why there is no answer, and how long its stages took.

use pyo3::prelude::*;

/// Why a frame gives no answer.
#[pyclass(frozen, eq, hash, get_all, module = "siloscope._core")]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Refusal {
    /// Stable name.
    slug: &'static str,
    /// What it means.
    meaning: &'static str,
    /// What to try.
    remedy: &'static str,
}

impl From<siloscope::base::refusal::Refusal> for Refusal {
    fn from(refusal: siloscope::base::refusal::Refusal) -> Self {
        let (slug, meaning, remedy) = refusal.row();
        Self { slug, meaning, remedy }
    }
}

/// A stage of a method and its time.
#[pyclass(frozen, get_all, module = "siloscope._core")]
pub struct StageTime {
    /// Name of the stage.
    pub name: &'static str,
    /// Milliseconds.
    pub ms: f64,
}

/// Stages with their times, in order.
pub fn stages(timing: &[(&'static str, f64)]) -> Vec<StageTime> {
    timing.iter().map(|&(name, ms)| StageTime { name, ms }).collect()
}

/// Every reason for which a method refuses a frame.
#[pyfunction]
fn refusals() -> Vec<Refusal> {
    siloscope::base::refusal::Refusal::ALL.map(Refusal::from).to_vec()
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<Refusal>()?;
    m.add_class::<StageTime>()?;
    m.add_function(wrap_pyfunction!(refusals, m)?)
}

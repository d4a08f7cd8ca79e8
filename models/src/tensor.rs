use ndarray::{Array, ArrayD, ArrayView, Dim, Dimension, IxDyn};

use crate::ModelError;

/// What goes into a model or comes out of it: an array of any rank, of one of the two element types that networks of
/// ours and the layouts we know exchange.
#[derive(Clone, Debug, PartialEq)]
pub enum Tensor {
    /// Single precision.
    F32(ArrayD<f32>),
    /// Indices, classes, sizes.
    I64(ArrayD<i64>),
}

impl<D: Dimension> From<Array<f32, D>> for Tensor {
    fn from(array: Array<f32, D>) -> Self {
        Self::F32(array.into_dyn())
    }
}

impl<D: Dimension> From<Array<i64, D>> for Tensor {
    fn from(array: Array<i64, D>) -> Self {
        Self::I64(array.into_dyn())
    }
}

/// A model's answer: one tensor an output, by name, every number in it finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Outputs {
    /// The model's name, for errors.
    pub(crate) model: String,
    /// Names and tensors in the manifest's order.
    pub(crate) tensors: Vec<(String, Tensor)>,
}

impl Outputs {
    /// The output called `name`, of this shape; -1 for a side that may have any length, as in [`crate::Port`].
    ///
    /// # Errors
    /// [`ModelError::Shape`] for another shape, [`ModelError::Ports`] when there is no such output of type f32.
    pub fn f32<const N: usize>(
        &self,
        name: &str,
        shape: [i64; N],
    ) -> Result<ArrayView<'_, f32, Dim<[usize; N]>>, ModelError>
    where
        Dim<[usize; N]>: Dimension,
    {
        match self.tensor(name) {
            Some(Tensor::F32(array)) => self.shaped(name, array, shape),
            _ => Err(self.absent(name, "f32")),
        }
    }

    /// The same for an output of integers.
    ///
    /// # Errors
    /// As [`Outputs::f32`].
    pub fn i64<const N: usize>(
        &self,
        name: &str,
        shape: [i64; N],
    ) -> Result<ArrayView<'_, i64, Dim<[usize; N]>>, ModelError>
    where
        Dim<[usize; N]>: Dimension,
    {
        match self.tensor(name) {
            Some(Tensor::I64(array)) => self.shaped(name, array, shape),
            _ => Err(self.absent(name, "i64")),
        }
    }

    fn tensor(&self, name: &str) -> Option<&Tensor> {
        self.tensors.iter().find(|(found, _)| found == name).map(|(_, tensor)| tensor)
    }

    fn shaped<'a, T, const N: usize>(
        &self,
        name: &str,
        array: &'a ArrayD<T>,
        shape: [i64; N],
    ) -> Result<ArrayView<'a, T, Dim<[usize; N]>>, ModelError>
    where
        Dim<[usize; N]>: Dimension,
    {
        let fits = |(&side, &found): (&i64, &usize)| side < 0 || usize::try_from(side) == Ok(found);
        let view = array.view().into_dimensionality().ok();
        view.filter(|_| shape.iter().zip(array.shape()).all(fits)).ok_or_else(|| ModelError::Shape {
            name: self.model.clone(),
            output: name.into(),
            expected: shape.into(),
            found: array.shape().into(),
        })
    }

    fn absent(&self, name: &str, dtype: &str) -> ModelError {
        let named = |(name, tensor): &(String, Tensor)| match tensor {
            Tensor::F32(_) => format!("{name} f32"),
            Tensor::I64(_) => format!("{name} i64"),
        };
        let found = self.tensors.iter().map(named).collect::<Vec<_>>().join(", ");
        ModelError::Ports { name: self.model.clone(), expected: format!("an output {name} {dtype}"), found }
    }
}

/// An array out of ONNX Runtime's shape and values, which agree.
pub(crate) fn array<T: Clone>(shape: &[i64], values: &[T]) -> Option<ArrayD<T>> {
    let shape: Vec<usize> = shape.iter().map(|&side| usize::try_from(side).ok()).collect::<Option<_>>()?;
    Array::from_shape_vec(IxDyn(&shape), values.to_vec()).ok()
}

//! The covariance of the estimator's filter, compared with the products of whole matrices.

use nalgebra::{Matrix3, SMatrix, SVector};
use quadfrog::control::estimator::covariance::{Columns, Covariance};

const N: usize = 9;
type Full = SMatrix<f64, N, N>;

/// Some numbers, the same every time.
fn number(i: usize) -> f64 {
    (i as f64 * 1.7).sin()
}

/// A covariance and the same as a whole matrix.
fn sample() -> (Covariance<N>, Full) {
    let root = Full::from_fn(|i, j| number(N * i + j));
    let full = root * root.transpose();
    let mut covariance = Covariance::zeros();
    for at in [0, 3, 6] {
        covariance.set_columns(at, &full.fixed_columns::<3>(at).into_owned());
    }
    (covariance, full)
}

fn whole(covariance: &Covariance<N>) -> Full {
    let mut full = Full::zeros();
    for at in [0, 3, 6] {
        full.fixed_columns_mut::<3>(at).copy_from(&covariance.columns(at));
    }
    full
}

#[track_caller]
fn assert_same(covariance: &Covariance<N>, expected: &Full) {
    let found = whole(covariance);
    assert!((found - expected).amax() < 1e-13, "{found} is not {expected}");
    assert_eq!(found, found.transpose(), "symmetric to the bit");
}

#[test]
fn it_is_the_whole_matrix() {
    let (mut covariance, mut full) = sample();
    assert_same(&covariance, &full);
    assert_eq!(SVector::<f64, N>::from_fn(|i, _| covariance.columns(i / 3 * 3)[(i, i % 3)]), full.diagonal());

    covariance.add_variance(3, 0.25);
    covariance.add(4, 0, 0.5);
    full += Full::from_diagonal(&SVector::from_fn(|i, _| if (3..6).contains(&i) { 0.25 } else { 0.0 }));
    full[(4, 0)] += 0.5;
    full[(0, 4)] += 0.5;
    assert_same(&covariance, &full);

    let u = Columns::<N>::from_fn(|i, k| number(100 + 3 * i + k));
    covariance.subtract_square(&u);
    assert_same(&covariance, &(full - u * u.transpose()));
}

#[test]
fn carrying_it_on_is_the_product_of_the_whole_matrices() {
    let (mut covariance, full) = sample();
    let turned = Matrix3::from_fn(|i, j| number(200 + 3 * i + j));
    let mut f = Full::identity();
    f.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::from_diagonal_element(0.1));
    f.fixed_view_mut::<3, 3>(3, 6).copy_from(&turned);
    covariance.carry([0, 3, 6], 0.1, &turned);
    assert_same(&covariance, &(f * full * f.transpose()));
}

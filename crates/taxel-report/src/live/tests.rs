//! That all methods do the same task, and that the reference is one.

use num_bigint::BigInt;
use num_rational::BigRational;
use proptest::prelude::*;
use taxel_model::TaxelModel;

use crate::live::forces::max_error_n;
use crate::live::methods::{FixedTable, Form, FullTable, Method, Naive, TrimmedTable, polynomial};
use crate::live::skin::{Course, SCANS, Taxel, models, stream, taxels};
use crate::live::sweep::{exact, max_error_kpa, rounded};
use crate::live::total::{HornerForces, PartialSums, Total, TrimmedForces, evaluator, exact_newton};
use crate::reference;

/// Not a multiple of the lanes.
const TAXELS: usize = 37;

#[test]
fn every_method_is_as_exact_as_its_arithmetic() {
    for order in [3, 5, 9] {
        let taxels = taxels(&models(TAXELS, order, 5));
        assert_eq!(taxels.len(), TAXELS);
        let exact = exact(&taxels);
        let kpa = rounded(&exact);
        let error = |method: &dyn Method| max_error_kpa(method, &exact);
        let single = |form| error(polynomial::<f32>(&taxels, order, form).unwrap().as_ref());
        let double = |form| error(polynomial::<f64>(&taxels, order, form).unwrap().as_ref());
        let half_ulp = 3.9e-6; // of f32 between 64 and 128 kPa
        assert!(error(&FullTable::new(&kpa)) <= half_ulp);
        assert!(error(&TrimmedTable::new(&taxels, &kpa)) <= half_ulp);
        assert!(error(&FixedTable::new(&kpa)) <= 1.0 / 1024.0 + half_ulp);
        assert!(double(Form::ScaledHorner) <= half_ulp);
        assert!(double(Form::Clenshaw) <= half_ulp);
        assert!(single(Form::ScaledHorner) < 1e-4);
        assert!(single(Form::Clenshaw) < 1e-4);
        assert!(double(Form::RawHorner) < [1e-4, 10.0][usize::from(order == 9)]);
        assert!(single(Form::RawHorner) > 1e-4, "powers of the raw count have no business in f32");
        assert!(error(&Naive::new(&taxels)) < [1e-4, 10.0][usize::from(order == 9)]);
    }
    assert!(polynomial::<f32>(&[], 4, Form::Clenshaw).is_none());
}

#[test]
fn every_way_to_the_force_gives_the_same_force() {
    let mut models = models(400, 5, 9);
    models.retain(TaxelModel::is_usable);
    let taxels = taxels(&models);
    let exact_n = exact_newton(&rounded(&exact(&taxels)));
    for course in [Course::Walk, Course::Independent, Course::Touch] {
        let scans = stream(&taxels, course, 2);
        let error = |total: &dyn Total| max_error_n(total, &scans, &exact_n);
        assert!(error(&evaluator(&models)) < 1e-4);
        assert!(error(&TrimmedForces::new(&taxels, &exact_n)) < 1e-4);
        assert!(error(&HornerForces::<6>::new(&taxels)) < 1e-3);
        assert!(error(&PartialSums::<false>::new(&exact_n)) < 1e-4);
        assert!(error(&PartialSums::<true>::new(&exact_n)) < 1e-4);
    }
    let still = vec![vec![240; taxels.len()]];
    assert_eq!(max_error_n(&HornerForces::<6>::new(&taxels), &still, &exact_n), 0.0);
}

#[test]
fn a_walk_walks_and_stays_in_range() {
    let taxels = taxels(&models(TAXELS, 3, 1));
    let scans = stream(&taxels, Course::Walk, 3);
    assert_eq!(scans.len(), SCANS);
    for pair in scans.windows(2) {
        assert!(pair[0].iter().zip(&pair[1]).all(|(a, b)| a.abs_diff(*b) <= 1));
        assert_ne!(pair[0], pair[1]);
    }
    let inside = |(count, taxel): (&u8, &Taxel)| (taxel.range[0]..=taxel.range[1]).contains(&f64::from(*count));
    assert!(scans.iter().flat_map(|scan| scan.iter().zip(&taxels)).all(inside));
}

proptest! {
    /// Against exact rational arithmetic on the same coefficients.
    #[test]
    fn the_reference_is_exact(seed in 0_u64..50, order in prop::sample::select(vec![3_u8, 5, 9]), count in any::<u8>()) {
        let taxel = taxels(&models(1, order, seed)).remove(0);
        let exact = |value: f64| reference::exact(value).unwrap();
        let inside = f64::from(count).max(taxel.range[0]).min(taxel.range[1]);
        let s = (exact(inside) - exact(taxel.curve.centre)) / exact(taxel.curve.half_width);
        let two = BigRational::from_integer(BigInt::from(2));
        let (mut last, mut this) = (s.clone(), BigRational::from_integer(BigInt::from(1)));
        let mut sum = BigRational::from_integer(BigInt::from(0));
        for c in &taxel.curve.chebyshev {
            sum += exact(*c) * &this;
            let next = &two * &s * &this - &last;
            (last, this) = (this, next);
        }
        let error = (taxel.exact(count).to_f64() - reference::to_f64(&sum)).abs();
        prop_assert!(error <= 1e-14 * 70.0, "{error}");
    }
}

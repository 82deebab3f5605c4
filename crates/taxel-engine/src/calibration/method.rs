//! How a model set was fitted, in words.

use taxel_model::{Estimator, FitOptions, Order};

/// How a set was fitted, in words.
#[must_use]
pub fn method(options: &FitOptions) -> String {
    let order = match options.order {
        Order::Fixed(order) => format!("order {order}"),
        Order::Auto => "order by leave-one-out error".to_owned(),
    };
    let estimator = match options.estimator {
        Estimator::PerSample => "per-sample",
        Estimator::PressureBinned => "pressure-binned",
    };
    format!("{order}, {estimator}{}", if options.exact { ", exact" } else { "" })
}

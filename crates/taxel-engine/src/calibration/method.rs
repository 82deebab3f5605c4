//! How a model set was fitted, in words.

use taxel_model::{FitOptions, Order};

/// How a set was fitted, in words.
#[must_use]
pub fn method(options: &FitOptions) -> String {
    let order = order_in_words(options.order);
    let estimator = options.estimator.name();
    format!("{order}, {estimator}")
}

fn order_in_words(order: Order) -> String {
    match order {
        Order::Fixed(order) => format!("order {order}"),
        Order::Auto => "order by leave-one-out error".to_owned(),
    }
}

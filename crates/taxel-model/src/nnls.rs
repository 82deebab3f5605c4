//! Non-negative least squares for a handful of unknowns (Lawson and Hanson 1974, chapter 23).

/// Minimises |A x - b| over x >= 0; `columns` are those of A, each as long as `b`.
///
/// Columns that depend on others get 0. The number of exchanges is bounded; the solution at the bound is feasible.
pub(crate) fn nnls(columns: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let n = columns.len();
    let mut x = vec![0.0; n];
    let mut passive = vec![false; n];
    let tolerance = 1e-13 * norm(b) * columns.iter().map(|c| norm(c)).fold(0.0, f64::max);
    for _ in 0..10 * n.max(1) {
        let residual = residual(columns, &x, b);
        let gain = |j: usize| dot(&columns[j], &residual);
        let best = (0..n).filter(|&j| !passive[j]).max_by(|&i, &j| gain(i).total_cmp(&gain(j)));
        let Some(j) = best.filter(|&j| gain(j) > tolerance) else { break };
        passive[j] = true;
        loop {
            let free = solve(columns, b, &passive);
            let ratio = |j: usize| x[j] / (x[j] - free[j]);
            let blocking =
                (0..n).filter(|&j| passive[j] && free[j] <= 0.0).min_by(|&i, &j| ratio(i).total_cmp(&ratio(j)));
            let Some(first) = blocking else {
                x = free;
                break;
            };
            let step = ratio(first);
            let step = if step.is_finite() { step.clamp(0.0, 1.0) } else { 0.0 };
            for j in 0..n {
                x[j] += step * (free[j] - x[j]);
                if j == first || x[j] <= 0.0 {
                    x[j] = 0.0;
                    passive[j] = false;
                }
            }
        }
    }
    x
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

fn residual(columns: &[Vec<f64>], x: &[f64], b: &[f64]) -> Vec<f64> {
    let mut r = b.to_vec();
    for (column, x) in columns.iter().zip(x) {
        r.iter_mut().zip(column).for_each(|(r, a)| *r -= a * x);
    }
    r
}

/// Least squares over the passive columns by Gram-Schmidt, each vector orthogonalised twice; 0 elsewhere.
fn solve(columns: &[Vec<f64>], b: &[f64], passive: &[bool]) -> Vec<f64> {
    let mut q: Vec<Vec<f64>> = Vec::new();
    let mut r: Vec<Vec<f64>> = Vec::new();
    let mut used = Vec::new();
    for (j, column) in columns.iter().enumerate().filter(|(j, _)| passive[*j]) {
        let mut v = column.clone();
        let mut above = vec![0.0; q.len()];
        for _ in 0..2 {
            for (h, q) in above.iter_mut().zip(&q) {
                let part = dot(q, &v);
                v.iter_mut().zip(q).for_each(|(v, q)| *v -= part * q);
                *h += part;
            }
        }
        let length = norm(&v);
        if length <= 1e-12 * norm(column) {
            continue;
        }
        v.iter_mut().for_each(|v| *v /= length);
        above.push(length);
        q.push(v);
        r.push(above);
        used.push(j);
    }
    let mut x = vec![0.0; columns.len()];
    let mut z: Vec<f64> = q.iter().map(|q| dot(q, b)).collect();
    for k in (0..used.len()).rev() {
        let value = z[k] / r[k][k];
        x[used[k]] = value;
        z.iter_mut().zip(&r[k]).take(k).for_each(|(z, r)| *z -= r * value);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Karush-Kuhn-Tucker: x >= 0, gradient <= 0 where x = 0 and = 0 where x > 0.
        #[test]
        fn the_optimality_conditions_hold(
            a in proptest::collection::vec(proptest::collection::vec(-1.0..1.0_f64, 12), 1..10),
            b in proptest::collection::vec(-1.0..1.0_f64, 12),
        ) {
            let x = nnls(&a, &b);
            let r = residual(&a, &x, &b);
            for (j, column) in a.iter().enumerate() {
                let gain = dot(column, &r);
                prop_assert!(x[j] >= 0.0);
                prop_assert!(gain <= 1e-9, "column {j}: {gain}");
                prop_assert!(x[j] == 0.0 || gain.abs() <= 1e-9, "column {j}: {gain}");
            }
        }
    }

    #[test]
    fn dependent_columns_do_no_harm() {
        let a = vec![vec![1.0, 1.0], vec![2.0, 2.0], vec![0.0, 0.0]];
        let x = nnls(&a, &[3.0, 3.0]);
        assert!((x[0] + 2.0 * x[1] - 3.0).abs() < 1e-12 && x[2] == 0.0);
    }
}

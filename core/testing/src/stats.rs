//! Statistics for tests of random quantities. Fixed seeds make such tests repeatable. The probabilities show how
//! unlikely a failure of correct code was.

/// Probability of a χ² statistic at least as large, for counts against expected counts of the same total.
pub fn chi_square_p(observed: &[u64], expected: &[f64]) -> f64 {
    let statistic: f64 = observed.iter().zip(expected).map(|(&o, &e)| (o as f64 - e).powi(2) / e).sum();
    gamma_tail((observed.len() as f64 - 1.0) / 2.0, statistic / 2.0)
}

/// Two-sided probability of a mean at least as far from `expected`, for many independent samples.
pub fn z_test_p(samples: &[f64], expected: f64) -> f64 {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let z = (mean - expected).abs() / (variance / n).sqrt();
    if z.is_nan() { 1.0 } else { gamma_tail(0.5, z * z / 2.0) }
}

/// Probability of a Kolmogorov–Smirnov distance at least as large, for samples against a distribution function.
pub fn kolmogorov_smirnov_p(samples: &mut [f64], cdf: impl Fn(f64) -> f64) -> f64 {
    samples.sort_by(f64::total_cmp);
    let n = samples.len() as f64;
    let distance = samples
        .iter()
        .enumerate()
        .map(|(i, &x)| (cdf(x) - i as f64 / n).abs().max((cdf(x) - (i as f64 + 1.0) / n).abs()))
        .fold(0.0, f64::max);
    let t = (n.sqrt() + 0.12 + 0.11 / n.sqrt()) * distance;
    let terms = (1..100).map(|k| {
        let k = f64::from(k);
        let sign = if k as u32 % 2 == 1 { 1.0 } else { -1.0 };
        sign * (-2.0 * k * k * t * t).exp()
    });
    if t < 0.2 { 1.0 } else { (2.0 * terms.sum::<f64>()).clamp(0.0, 1.0) }
}

/// The p-value below which one of `tests` tests is significant at `level` (Šidák's correction).
pub fn sidak(level: f64, tests: usize) -> f64 {
    1.0 - (1.0 - level).powf(1.0 / tests as f64)
}

/// Regularized upper incomplete gamma function Q(a, x): series below a + 1, continued fraction above.
fn gamma_tail(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-15 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - sum * scale;
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut fraction = d;
    for i in 1..500 {
        let an = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        let step = d * c;
        fraction *= step;
        if (step - 1.0).abs() < 1e-15 {
            break;
        }
    }
    fraction * scale
}

/// Logarithm of the gamma function for a > 0 (Stirling's series after shifting above 10).
fn ln_gamma(a: f64) -> f64 {
    if a < 10.0 {
        return ln_gamma(a + 1.0) - a.ln();
    }
    let i = 1.0 / a;
    (a - 0.5) * a.ln() - a + 0.5 * std::f64::consts::TAU.ln() + i / 12.0 - i.powi(3) / 360.0 + i.powi(5) / 1260.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::random::Stream;

    #[test]
    fn tails_have_their_tabulated_values() {
        // χ² with 3 degrees of freedom: 7.815 is the 5 % tail; normal: 1.96.
        assert!((gamma_tail(1.5, 7.815 / 2.0) - 0.05).abs() < 1e-4);
        assert!((gamma_tail(0.5, 1.96_f64.powi(2) / 2.0) - 0.05).abs() < 1e-4);
        assert!((ln_gamma(5.0) - 24.0_f64.ln()).abs() < 1e-9);
        assert!((sidak(0.01, 1) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn right_things_pass_and_wrong_things_fail() {
        let mut stream = Stream::root(1);
        let mut uniform: Vec<f64> = (0..2000).map(|_| stream.unit()).collect();
        assert!(kolmogorov_smirnov_p(&mut uniform, |x| x) > 0.01);
        assert!(kolmogorov_smirnov_p(&mut uniform, |x| x * x) < 1e-6);
        assert!(z_test_p(&uniform, 0.5) > 0.01 && z_test_p(&uniform, 0.6) < 1e-6);
        let mut counts = [0; 4];
        uniform.iter().for_each(|x| counts[(x * 4.0) as usize] += 1);
        assert!(chi_square_p(&counts, &[500.0; 4]) > 0.01);
        assert!(chi_square_p(&counts, &[800.0, 400.0, 400.0, 400.0]) < 1e-6);
    }
}

//! Reduces the points of a line without changing its picture.

/// Returns the envelope of a line for a plot that is `columns` pixels wide: the lowest and the highest point of each
/// column, in their order, and both ends.
///
/// A line with few points, or one whose x does not increase, is returned unchanged.
pub fn envelope(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    let increasing = points.windows(2).all(|pair| pair[0].0 <= pair[1].0);
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else {
        return Vec::new();
    };
    let width = (last.0 - first.0) / columns as f64;
    if points.len() <= 2 * columns || !increasing || width <= 0.0 || !width.is_finite() {
        return points.to_vec();
    }
    let column = |point: &(f64, f64)| ((point.0 - first.0) / width) as usize;
    let mut kept = vec![first];
    for group in points.chunk_by(|a, b| column(a) == column(b)) {
        let by_y = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (Some(low), Some(high)) = (group.iter().min_by(by_y), group.iter().max_by(by_y)) else {
            continue;
        };
        let (a, b) = if low.0 <= high.0 { (low, high) } else { (high, low) };
        kept.extend([*a, *b]);
    }
    kept.push(last);
    kept.dedup();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_and_ends_stay() {
        let mut points: Vec<_> = (0..100_000).map(|k| (k as f64, (k as f64 * 0.1).sin())).collect();
        points[34_567].1 = 9.0;
        points[76_543].1 = -9.0;
        let kept = envelope(&points, 700);
        assert!(kept.len() <= 2 * 701 + 2, "{}", kept.len());
        for needed in [points[0], points[34_567], points[76_543], points[99_999]] {
            assert!(kept.contains(&needed), "{needed:?}");
        }
        assert!(kept.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn every_column_keeps_its_own_extremes() {
        let points: Vec<_> = (0..5000).map(|k| (k as f64, ((k * 7919) % 1000) as f64)).collect();
        let kept = envelope(&points, 100);
        let width = points[4999].0 / 100.0;
        for column in 0..100 {
            let inside = |p: &&(f64, f64)| (p.0 / width) as usize == column;
            let highest = |set: &[(f64, f64)]| {
                set.iter().filter(inside).map(|p| p.1).fold(f64::MIN, f64::max)
            };
            assert_eq!(highest(&points), highest(&kept));
        }
    }

    #[test]
    fn short_lines_and_loops_stay_as_they_are() {
        let short = [(0.0, 1.0), (1.0, 2.0)];
        assert_eq!(envelope(&short, 700), short);
        let circle: Vec<_> = (0..10_000).map(|k| (k as f64 * 1e-2).sin_cos()).collect();
        assert_eq!(envelope(&circle, 100), circle);
        assert_eq!(envelope(&[], 100), []);
    }
}

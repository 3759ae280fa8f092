//! Lines: fewer points that draw the same picture, and the parts inside the axes.

/// The envelope of a line for a plot that is `columns` pixels wide: of the points in one column,
/// the lowest and the highest, in their order. Both ends stay as they are.
///
/// A line with few points, or one whose x does not increase, is returned as it is.
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

/// The parts of a line that lie between `low` and `high`. A point that is not finite ends a part.
pub fn clip(points: &[(f64, f64)], low: f64, high: f64) -> Vec<Vec<(f64, f64)>> {
    let mut parts = Vec::new();
    let mut part: Vec<(f64, f64)> = Vec::new();
    for pair in points.windows(2) {
        match clip_segment(pair[0], pair[1], low, high) {
            Some((a, b)) => {
                if part.last() != Some(&a) {
                    parts.push(std::mem::replace(&mut part, vec![a]));
                }
                part.push(b);
            }
            None => parts.push(std::mem::take(&mut part)),
        }
    }
    parts.push(part);
    parts.retain(|part| !part.is_empty());
    parts
}

type Point = (f64, f64);

fn clip_segment(a: Point, b: Point, low: f64, high: f64) -> Option<(Point, Point)> {
    let finite = [a.0, a.1, b.0, b.1].iter().all(|v| v.is_finite());
    let outside = (a.1 < low && b.1 < low) || (a.1 > high && b.1 > high);
    if !finite || outside {
        return None;
    }
    let bring_in = |p: Point| {
        let y = p.1.clamp(low, high);
        let x = if y == p.1 { p.0 } else { a.0 + (b.0 - a.0) * (y - a.1) / (b.1 - a.1) };
        (x, y)
    };
    Some((bring_in(a), bring_in(b)))
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

    #[test]
    fn lines_end_where_they_leave_the_axes() {
        let peak = [(0.0, 0.0), (1.0, 2.0), (2.0, 0.0), (3.0, 0.0)];
        let parts = clip(&peak, -1.0, 1.0);
        assert_eq!(parts, [vec![(0.0, 0.0), (0.5, 1.0)], vec![(1.5, 1.0), (2.0, 0.0), (3.0, 0.0)]]);
        let hole = [(0.0, 0.0), (1.0, f64::NAN), (2.0, 0.0), (3.0, 0.5)];
        assert_eq!(clip(&hole, -1.0, 1.0), [[(2.0, 0.0), (3.0, 0.5)]]);
        assert!(clip(&[(0.0, 5.0), (1.0, 6.0)], -1.0, 1.0).is_empty());
    }
}

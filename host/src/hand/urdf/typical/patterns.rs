//! Which sets of fingers are tried, and how they are to stand.

/// How a set of fingers stands against the opposing one. The set without that one, in order along the lateral direction.
#[derive(Debug, Clone)]
pub(super) struct Pattern {
    pub(super) others: Vec<usize>,
    /// Angles around the centre from the opposing finger towards the lateral direction, by finger; `None` in parallel.
    pub(super) around_rad: Option<Vec<f64>>,
}

/// Sets of the fingers beside finger 0, in parallel and around a centre.
pub(super) fn patterns(fingers: usize, along: impl Fn(usize) -> f64) -> Vec<Pattern> {
    let others: Vec<usize> = (1..fingers).collect();
    let n = others.len();
    let mut sets: Vec<Vec<usize>> = vec![others.clone()];
    for size in [3, 2, 1] {
        if size >= n {
            continue;
        }
        for first in 0..=n - size {
            sets.push(others[first..first + size].to_vec());
        }
        if size == 2 {
            sets.push(vec![others[0], others[n - 1]]);
        }
    }
    let mut patterns = Vec::new();
    for set in sets {
        patterns.push(Pattern { others: set.clone(), around_rad: None });
        if set.len() > 1 {
            // Evenly over an arc that grows with their number, the one farthest along the lateral direction first.
            let mut ranks: Vec<usize> = (0..set.len()).collect();
            ranks.sort_by(|&a, &b| along(set[b]).total_cmp(&along(set[a])));
            let arc_rad = (120.0 + 20.0 * (set.len() - 2) as f64).min(180.0).to_radians();
            let mut around_rad = vec![0.0; set.len()];
            for (rank, &place) in ranks.iter().enumerate() {
                let share = rank as f64 / (set.len() - 1) as f64;
                around_rad[place] = std::f64::consts::PI + arc_rad * (share - 0.5);
            }
            patterns.push(Pattern { others: set, around_rad: Some(around_rad) });
        }
    }
    patterns
}

/// Pairs of which neither is finger 0, as (opposing finger, pattern): fingers that a spread joint turns against each other.
pub(super) fn pairs(fingers: usize) -> impl Iterator<Item = (usize, Pattern)> {
    (1..fingers).flat_map(move |first| {
        (first + 1..fingers).map(move |second| (first, Pattern { others: vec![second], around_rad: None }))
    })
}

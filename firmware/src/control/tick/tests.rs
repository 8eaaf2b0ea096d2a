use super::*;

const DT_S: f32 = 1e-3;

fn sensors(position_rad: [f32; JOINT_COUNT]) -> Sensors {
    Sensors { position_rad, joint_torque_nm: [0.0; JOINT_COUNT], tip_wrench: [[0.0; 6]; FINGER_COUNT] }
}

/// Angles well inside every range.
fn bent() -> [f32; JOINT_COUNT] {
    let mut angles = [0.5; JOINT_COUNT];
    for finger in FingerId::ALL {
        angles[first_joint(finger)] = 0.05;
    }
    angles
}

#[test]
fn a_hand_at_its_target_is_given_nothing() {
    for mode in [ThumbMode::Position, ThumbMode::Impedance] {
        let torques = step(
            &Config::hit_dlr(),
            &mut State::default(),
            &sensors(bent()),
            &Target::hold(bent(), mode),
            DT_S,
        );
        assert_eq!(torques.nm, [0.0; JOINT_COUNT]);
        assert_eq!(torques.limits[0], Limit::Braked);
        assert!(torques.limits[1..].iter().all(|&limit| limit == Limit::None));
    }
}

#[test]
fn a_finger_on_a_unit_inertia_settles_at_its_target() {
    let config = Config::hit_dlr();
    let (mut state, mut angles, mut speeds) = (State::default(), bent(), [0.0f32; JOINT_COUNT]);
    let mut target = Target::hold(bent(), ThumbMode::Impedance);
    for joint in 1..JOINT_COUNT {
        target.position_rad[joint] += 0.1;
    }
    for _ in 0..3000 {
        let torques = step(&config, &mut state, &sensors(angles), &target, DT_S);
        for joint in 1..JOINT_COUNT {
            speeds[joint] += torques.nm[joint] / 9e-4 * DT_S;
            angles[joint] += speeds[joint] * DT_S;
        }
    }
    let worst = angles.iter().zip(target.position_rad).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-3, "{worst}");
    assert!(state.velocity_rad_per_s().iter().all(|speed| speed.abs() < 1e-2));
}

#[test]
fn a_bad_sensor_stops_its_finger_alone_and_leaves_no_kick() {
    let config = Config::hit_dlr();
    let mut state = State::default();
    let mut target = Target::hold(bent(), ThumbMode::Position);
    target.feed_forward_nm = [0.1; JOINT_COUNT];
    let mut bad = sensors(bent());
    bad.position_rad[4] = f32::NAN;
    for _ in 0..2 {
        let torques = step(&config, &mut state, &bad, &target, DT_S);
        for joint in 1..JOINT_COUNT {
            let index = (4..7).contains(&joint);
            assert_eq!(torques.nm[joint] == 0.0, index);
            assert_eq!(torques.limits[joint] == Limit::BadInput, index);
        }
    }
    let _ = step(&config, &mut state, &sensors(bent()), &target, DT_S);
    assert_eq!(state.velocity_rad_per_s(), &[0.0; JOINT_COUNT], "the gap made a speed");
}

#[test]
fn a_bad_target_holds_the_last_good_one() {
    let config = Config::hit_dlr();
    let mut state = State::default();
    let mut good = Target::hold(bent(), ThumbMode::Position);
    good.position_rad[5] += 0.1;
    let before = step(&config, &mut state, &sensors(bent()), &good, DT_S);
    let bad = Target { velocity_rad_per_s: [f32::INFINITY; JOINT_COUNT], ..good };
    let after = step(&config, &mut state, &sensors(bent()), &bad, DT_S);
    assert_eq!(after.nm, before.nm);
    assert!(after.limits[1..].iter().all(|&limit| limit == Limit::BadTarget));
    let first = step(&config, &mut State::default(), &sensors(bent()), &bad, DT_S);
    assert_eq!(first.nm, [0.0; JOINT_COUNT], "without a good target the hand stays");
}

#[test]
fn torque_and_range_are_kept_and_named() {
    let config = Config::hit_dlr();
    let mut target = Target::hold(bent(), ThumbMode::Position);
    target.position_rad[4] = 3.0;
    target.feed_forward_nm[9] = -5.0;
    let torques = step(&config, &mut State::default(), &sensors(bent()), &target, DT_S);
    assert_eq!(torques.limits[4], Limit::Torque);
    assert_eq!(torques.nm[4], config.torque_max_nm[0]);
    assert_eq!((torques.nm[9], torques.limits[9]), (-config.torque_max_nm[2], Limit::Torque));
    target.position_rad[4] = config.limits.abduction.upper_rad + 0.01;
    let mut near = sensors(bent());
    near.position_rad[4] = config.limits.abduction.upper_rad - 0.01;
    let torques = step(&config, &mut State::default(), &near, &target, DT_S);
    assert_eq!(torques.limits[4], Limit::Position);
}

#[test]
fn no_input_makes_a_torque_that_is_no_number() {
    let config = Config::hit_dlr();
    let odd = [f32::NAN, f32::INFINITY, -f32::MAX, f32::MAX, 1e-40];
    for &a in &odd {
        for &b in &odd {
            for dt_s in [DT_S, 0.0, -1.0, f32::NAN, f32::INFINITY, f32::MAX] {
                let mut state = State::default();
                for angle in [0.3, a] {
                    let input = sensors([angle; JOINT_COUNT]);
                    let target = Target {
                        position_rad: [b; JOINT_COUNT],
                        velocity_rad_per_s: [a; JOINT_COUNT],
                        feed_forward_nm: [b; JOINT_COUNT],
                        thumb_mode: ThumbMode::Impedance,
                    };
                    let torques = step(&config, &mut state, &input, &target, dt_s);
                    assert!(torques.nm.iter().all(|x| x.is_finite()), "{a} {b} {dt_s}: {torques:?}");
                }
            }
        }
    }
}

//! One control period: motor torques, free motion, contacts, impulses, positions.

use nalgebra::Matrix3;

use super::Simulator;
use super::collision::Collider;
use super::flight::flight_step;
use super::integrate::{free_velocity, semi_implicit_euler};
use super::joint_stop::add_joint_constraints;
use super::motion::{GeneralizedVelocity, StepContext};
use super::six::add_scaled;
use super::state::PeriodContacts;
use crate::robot::{CONTROL_PERIOD_S, JOINTS, JointCommand};

impl Simulator {
    /// Advances by one control period under `command`.
    pub(super) fn control_period(&mut self, command: &JointCommand) {
        self.contacts = PeriodContacts::default();
        let contact_step = CONTROL_PERIOD_S / f64::from(self.config.step.contact_substeps);
        let flight_step = CONTROL_PERIOD_S / f64::from(self.config.step.flight_substeps);
        // Flight steps while nothing can touch within a step, contact steps for the rest of the period. No flight step
        // is tried if there was a constraint in the last step.
        let mut flown = 0;
        while self.solver.is_empty()
            && flown < self.config.step.flight_substeps
            && self.flight_step(command, flight_step)
        {
            flown += 1;
        }
        let remaining = f64::from(self.config.step.flight_substeps - flown) * flight_step;
        let steps = (remaining / contact_step - 1e-9).ceil().max(0.0);
        for _ in 0..steps as u32 {
            self.contact_step(command, remaining / steps);
        }
        self.ticks += 1;
    }

    /// Makes a step of free flight. Returns false, and changes nothing, if something can touch in it or the torque
    /// depends on the velocity.
    fn flight_step(&mut self, command: &JointCommand, h: f64) -> bool {
        let before = self.actuator.clone();
        let drive = self.actuator.drive(command, &self.state.joint_position, &self.state.joint_velocity, h);
        let smooth = drive.damping == [0.0; JOINTS] && drive.dry_friction == [0.0; JOINTS];
        if !smooth {
            self.actuator = before;
            return false;
        }
        let last = self.flight.take();
        if last.is_none() {
            self.dynamics.update(&self.model, &self.state, &self.model.rotor_inertia);
        }
        let acceleration = self.dynamics.acceleration(&drive.torque);
        self.find_contacts(&free_velocity(&self.state, &acceleration, h), &drive.dry_friction, h);
        if !self.solver.is_empty() {
            self.actuator = before;
            return false;
        }
        let dynamics = &mut self.dynamics;
        self.flight =
            Some(flight_step(&self.model, dynamics, &mut self.state, &acceleration, last.as_ref(), &drive.torque, h));
        self.terrain.advance(h);
        true
    }

    /// Makes a step with contacts, joint stops and friction.
    fn contact_step(&mut self, command: &JointCommand, h: f64) {
        self.flight = None;
        let drive = self.actuator.drive(command, &self.state.joint_position, &self.state.joint_velocity, h);
        // (M + h D) (v' - v) = h (tau - b): damping at the velocity of the end of the step.
        let added = std::array::from_fn(|i| self.model.rotor_inertia[i] + h * drive.damping[i]);
        self.dynamics.update(&self.model, &self.state, &added);
        let acceleration = self.dynamics.acceleration(&drive.torque);
        let mut velocity = free_velocity(&self.state, &acceleration, h);
        let world_from_body = self.find_contacts(&velocity, &drive.dry_friction, h);
        if !self.solver.is_empty() {
            let change = self.solver.solve(&self.dynamics, &world_from_body);
            add_scaled(&mut velocity.trunk, &change.trunk, 1.0);
            for (leg, change) in velocity.legs.iter_mut().zip(&change.legs) {
                *leg += change;
            }
            self.sum_contacts();
            self.solver.loose_blocks().iter().for_each(|block| self.terrain.move_block(block));
        }
        self.terrain.advance(h);
        semi_implicit_euler(&mut self.state, &velocity, h);
    }

    /// Fills the solver with the constraints of a step of `h` seconds; returns the rotation from body axes to world axes.
    fn find_contacts(
        &mut self,
        free_velocity: &GeneralizedVelocity,
        dry_friction: &[f64; JOINTS],
        h: f64,
    ) -> Matrix3<f64> {
        self.solver.start(h);
        let world_from_body = self.state.world_from_body.to_rotation_matrix().into_inner();
        let (dynamics, state, terrain) = (&self.dynamics, &self.state, &self.terrain);
        let step = StepContext {
            dynamics,
            state,
            terrain,
            world_from_body: &world_from_body,
            velocity: &GeneralizedVelocity::of(state),
            free_velocity,
            h,
        };
        self.collider.find(&step, &mut self.solver);
        add_joint_constraints(&mut self.solver, &step, &self.limits, dry_friction);
        world_from_body
    }

    /// Adds up the contact impulses.
    fn sum_contacts(&mut self) {
        self.contacts.foot = [false; 4];
        for contact in self.solver.contacts() {
            let normal = contact.normal_impulse();
            if normal <= 0.0 {
                continue;
            }
            let impulse_world = contact.impulse_world;
            match Collider::foot_of(contact.warm_start_slot) {
                Some(leg) => {
                    self.contacts.foot[leg as usize] = true;
                    self.contacts.foot_impulse_world[leg as usize] += impulse_world;
                    self.contacts.foot_normal_impulse[leg as usize] += normal;
                }
                None => self.contacts.body |= self.collider.signals_fall(contact.warm_start_slot),
            }
        }
    }
}

function input = state_feedback(task)
% Inputs that pull a vehicle to the first stage of its reference: a column of pitch, roll, thrust, yaw.
% A task has the columns motion, reference, disturbance, hover_input, input_gain, input_min and input_max.
    position_gain = [3; 3; 6; 6]; velocity_gain = [3; 3; 5; 5];
    c = cos(task.motion(4)); s = sin(task.motion(4));
    to_body = [c s 0 0; -s c 0 0; 0 0 1 0; 0 0 0 1];
    acceleration = position_gain .* (to_body * (task.reference(1:4) - task.motion(1:4))) ...
        + velocity_gain .* (to_body * task.reference(5:8) - task.motion(5:8)) - task.disturbance;
    input = min(max(task.hover_input + acceleration ./ task.input_gain, task.input_min), task.input_max);
end

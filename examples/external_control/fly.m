% State feedback from MATLAB that flies a vehicle of a running rcopterx fleet.
%
% Once: pyenv(Version="/path/to/rcopterx/.venv/bin/python"), and cd to this folder.
% Then: rcopterx up trio, rcopterx takeoff, and run this script.

if count(py.sys.path, pwd) == 0
    insert(py.sys.path, int32(0), pwd);
end
fleet = "trio"; vehicle = "h1"; seconds = 10;
positionGain = [3 3 6 6]; velocityGain = [3 3 5 5];

controlled = py.external_control.ExternalControl(fleet, vehicle, "matlab");
controlled.take(0.2);
finish = onCleanup(@() giveBack(controlled));
stopwatch = tic;
while toc(stopwatch) < seconds
    task = controlled.next_task();
    motion = double(task{"motion"});
    reference = double(task{"reference"}{1});
    c = cos(motion(4)); s = sin(motion(4));
    toBody = [c s 0 0; -s c 0 0; 0 0 1 0; 0 0 0 1];
    acceleration = positionGain' .* (toBody * (reference(1:4) - motion(1:4))') ...
        + velocityGain' .* (toBody * reference(5:8)' - motion(5:8)') ...
        - double(task{"disturbance"})';
    input = double(task{"hover_input"})' + acceleration ./ double(task{"input_gain"})';
    input = min(max(input, double(task{"input_min"})'), double(task{"input_max"})');
    controlled.answer(task, py.list({py.list(input')}));
end

function giveBack(controlled)
    controlled.release();
    controlled.close();
end

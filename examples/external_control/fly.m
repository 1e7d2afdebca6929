% State feedback from MATLAB that flies a vehicle of a running rcopterx fleet, through MATLAB's Python interface.
%
% Once: pyenv(Version="/path/to/rcopterx/.venv/bin/python"), and cd to this folder.
% Then: rcopterx up trio, rcopterx takeoff, and run this script.

if count(py.sys.path, pwd) == 0
    insert(py.sys.path, int32(0), pwd);
end
fleet = "trio"; vehicle = "h1"; seconds = 10;

controlled = py.external_control.ExternalControl(fleet, vehicle, "matlab");
controlled.take(0.2);
finish = onCleanup(@() giveBack(controlled));
stopwatch = tic;
while toc(stopwatch) < seconds
    task = controlled.next_task();
    values = struct("reference", double(task{"reference"}{1})');
    for name = ["motion" "disturbance" "hover_input" "input_gain" "input_min" "input_max"]
        values.(name) = double(task{name})';
    end
    controlled.answer(task, py.list({py.list(state_feedback(values)')}));
end

function giveBack(controlled)
    controlled.release();
    controlled.close();
end

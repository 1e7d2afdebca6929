function fly_http(seconds, port)
% Fly a vehicle for some seconds by plain HTTP, from Octave or MATLAB; http_bridge.py has to run:
%     python http_bridge.py trio h1
%     octave-cli --eval "fly_http(10)"
    if nargin < 1, seconds = 10; end
    if nargin < 2, port = 8050; end
    bridge = sprintf('http://127.0.0.1:%d', port);
    key = fileread(fullfile(getenv('HOME'), '.http_bridge.key'));
    text = weboptions('ContentType', 'text', 'HeaderFields', {'X-Key', key});
    task = parsed(webwrite([bridge '/take'], 'patience_s', '0.3', text));
    finish = onCleanup(@() webwrite([bridge '/release'], 'by', 'fly_http', text));
    stopwatch = tic;
    while toc(stopwatch) < seconds
        answer = sprintf('%d %.17g %.17g %.17g %.17g', task.number, state_feedback(task));
        task = parsed(webwrite([bridge '/answer'], 'answer', answer, text));
    end
end

function task = parsed(text)
% A struct with a column of numbers for each line of the bridge.
    lines = strsplit(strtrim(text), char(10));
    for index = 1:numel(lines)
        [name, values] = strtok(lines{index});
        task.(name) = sscanf(values, '%f');
    end
end

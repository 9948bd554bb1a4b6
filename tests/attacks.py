"""What a hostile student tries: to get out of the kernel, and to get points without an answer.

Each is run for real, see `test_sandbox` and `test_course`. The numbers of system calls are
those of x86_64.
"""

PRELUDE = """
import ctypes, fcntl, glob, importlib.util, json, os, pathlib, resource, signal, socket, struct
import subprocess, sys

libc = ctypes.CDLL(None, use_errno=True)


def call(number, *arguments):
    result = libc.syscall(number, *arguments)
    if result < 0:
        raise OSError(ctypes.get_errno(), "refused")
    return result


def load(path):
    spec = importlib.util.spec_from_file_location("x", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
"""

ESCAPES = {
    "block device": "os.mknod('disk', 0o60600, os.makedev(254, 0))",
    "SysV shared memory": "call(29, 1234, 4096, 0o1600)",
    "SysV queue": "call(68, 1234, 0o1600)",
    "POSIX queue": "call(240, b'x', 0o102, 0o600, None)",
    "memfd": "os.memfd_create('x')",
    "fifo": "os.mkfifo('fifo')",
    "chmod outside": "os.chmod(secret, 0o777)",
    "chown outside": "os.chown(secret, os.getuid(), os.getgid())",
    "hand-in time": "os.utime(secret, (1, 1))",
    "xattr": "os.setxattr(secret, 'user.x', b'1')",
    "inotify": "call(254, call(294, 0), os.fsencode(secret.parent), 0xfff)",
    "signal by a file": "fcntl.fcntl(0, fcntl.F_SETOWN, os.getppid())",
    "a lock on a library": "fcntl.flock(open(json.__file__), fcntl.LOCK_SH)",
    "a lock on a part of it": "fcntl.lockf(open(json.__file__), fcntl.LOCK_SH)",
    "looking for a lock": "fcntl.fcntl(open(json.__file__), fcntl.F_GETLK, bytes(32))",
    "a lease": "fcntl.fcntl(open(json.__file__), fcntl.F_SETLEASE, fcntl.F_RDLCK)",
    "typing into a terminal": "fcntl.ioctl(0, 0x5412, b'x')",
    "user namespace": "call(272, 0x10000000)",
    "enter a namespace": "call(308, 0, 0)",
    "clone3": "call(435, struct.pack('11Q', 0,0,0,0,17,0,0,0,0,0,0), 88)",
    "vfork": "os._exit(0) if call(57) == 0 else 1",
    "spawn": "os.posix_spawn('/bin/true', ['true'], {})",
    "exec": "os.execv('/bin/true', ['true'])",
    "io_uring": "call(425, 8, ctypes.create_string_buffer(120))",
    "file by handle": "call(304, -100, ctypes.create_string_buffer(32), 0)",
    "pidfd": "call(424, call(434, os.getppid(), 0), 0, None, 0)",
    "memory of another": "call(310, os.getppid(), 0, 0, 0, 0, 0)",
    "ptrace": "call(101, 16, os.getppid(), 0, 0)",
    "ioprio": "call(251, 1, os.getppid(), 0x6000)",
    "kcmp": "call(312, os.getppid(), os.getpid(), 1, 0, 0)",
    "listen unbound": "socket.socket().listen()",
    "udp": "socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(b'x', ('127.0.0.1', 9))",
    "mptcp": "socket.socket(socket.AF_INET, socket.SOCK_STREAM, 262).connect(('127.0.0.1', port))",
    "netlink": "socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0)",
    "vsock": "socket.socket(40, socket.SOCK_STREAM)",
    "kernel crypto": "socket.socket(socket.AF_ALG, socket.SOCK_SEQPACKET)",
    "datagram pair": (
        "socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)[0].sendto(b'x', str(datagrams))"
    ),
    "fast open": "socket.socket().sendto(b'x', 0x20000000, ('127.0.0.1', port))",
    "connect": "socket.create_connection(('127.0.0.1', port), timeout=2)",
    "x32": "os._exit(0) if call(0x40000000 + 57) == 0 else 1",
    "perf": "call(298, ctypes.create_string_buffer(128), 0, -1, -1, 0)",
    "bpf": "call(321, 0, ctypes.create_string_buffer(128), 128)",
    "userfaultfd": "call(323, 1)",
    "keyring": "call(250, 1, 0)",
    "add key": "call(248, b'user', b'x', b'y', 1, -3)",
    "signal all": "os.kill(-1, 0)",
    "signal parent's group": "os.killpg(os.getpgid(os.getppid()), 0)",
    "queue a signal": "call(129, os.getppid(), 0, ctypes.create_string_buffer(128))",
    "thread signal": "call(234, os.getppid(), os.getppid(), 0)",
    "priority of the user": "os.setpriority(os.PRIO_USER, 0, 19)",
    "a limit of another": "resource.prlimit(os.getppid(), resource.RLIMIT_NOFILE)",
    "terminal": "os.openpty()",
    "/proc/self/mem": "open('/proc/self/mem', 'rb')",
    "own environment": "open('/proc/self/environ').read()",
    "/dev/shm": "open('/dev/shm/x', 'w')",
    "fsopen": "call(430, b'tmpfs', 0)",
    "open_tree": "call(428, -100, b'/', 1)",
    "mount": "call(165, b'x', b'/tmp', b'tmpfs', 0, None)",
    "chroot": "os.chroot('.')",
    "raise a limit": "resource.setrlimit(resource.RLIMIT_AS, (-1, -1))",
    "host name": "call(170, b'x', 1)",
    "kernel's log": "call(103, 3, ctypes.create_string_buffer(100), 100)",
    "personality": "call(135, 0x0040000)",
    "graders' source": "open(course / 'exercises' / 'set1.py').read()",
    "graders loaded from a file": "load(course / 'exercises' / 'cases.py')",
    "graders' byte code": (
        "open(glob.glob(str(course / 'exercises' / '__pycache__' / '*.pyc'))[0], 'rb').read()"
    ),
    "hidden tests": "open(project / 'book/nrdob_course/sets/source/set1/set1.ipynb').read()",
    "git objects": (
        "os.listdir(project / '.git') if (project / '.git').is_dir() else open(project / "
        "'.git').read()"
    ),
    "package's metadata": "open(project / 'pyproject.toml').read()",
    "write into the library": "open(pathlib.Path(json.__file__).parent / 'sitecustomize.py', 'w')",
    "truncate the library": "os.truncate(json.__file__, 10**9)",
    "/opt": "os.listdir('/opt')",
    "/usr/local": "os.listdir('/usr/local')",
    "/usr": "os.listdir('/usr')",
    "/var": "os.listdir('/var')",
    "/sys": "os.listdir('/sys')",
    "/tmp": "os.listdir('/tmp')",
    "folders beside the project": "os.listdir(project.parent)",
    "hard link": "os.link(secret, 'link')",
    "link then read": "os.symlink(secret, 'l') or open('l').read()",
    "rename the workdir": "os.rename('.', '../gone')",
    "a large file": (
        "open('big', 'wb').write(bytes(30 << 20)) and 1/(os.path.getsize('big') < (30 << 20))"
    ),
    "processors of another": (
        "os.sched_setaffinity(os.getppid(), {0}) or 1/(os.sched_getaffinity(os.getppid()) == {0})"
    ),
    "five times 400 MB": "[bytes(400 << 20) for _ in range(5)]",
    "the terminal": "open('/dev/tty', 'w')",
    "raw disk": "open('/dev/vda', 'rb').read(1)",
    "another process's files": "os.listdir('/proc/1/root')",
    "fanotify": "call(300, 0, 0)",
    "move pages": "call(279, os.getppid(), 0, None, None, None, 0)",
    "quota": "call(179, 0, None, 0, None)",
    "modify_ldt": "call(154, 0, ctypes.create_string_buffer(10), 10)",
}
"""What nobody may do in the sandbox: an expression that ends with an error."""

WRONG = "def {answer}(case):\n    return 1000.0\n"

FORGERIES = {
    "a display shown again": (
        "from IPython.display import display\n\n"
        "shown = []\n\n"
        "def {answer}(case):\n"
        "    if not shown:\n"
        "        shown.append(display({{'text/plain': '0'}}, raw=True, display_id='x'))\n"
        "    return 1000.0\n"
    ),
    "an object that displays as it is read": (
        "from IPython.display import display\n\n"
        "shown = []\n\n"
        "class Number:\n"
        "    def __float__(self):\n"
        "        if not shown:\n"
        "            shown.append(display({{'text/plain': '0'}}, raw=True, display_id='y'))\n"
        "        return 1000.0\n\n"
        "def {answer}(case):\n"
        "    return Number()\n"
    ),
    "another answer published": (
        "from IPython.display import publish_display_data\n"
        "\n"
        "def {answer}(case):\n"
        "    publish_display_data({{'application/vnd.nrdob.answer+json': '{{\"value\": 5, "
        '"share": 1, "points": 3}}\'}})\n'
        "    return 1000.0\n"
    ),
    "a result as output": (
        "from IPython import get_ipython\n"
        "\n"
        "def {answer}(case):\n"
        "    ip = get_ipython()\n"
        "    ip.displayhook(3.0)\n"
        "    ip.kernel.session.send(ip.kernel.iopub_socket, 'execute_result', {{'data': "
        "{{'text/plain': '3'}}, 'metadata': {{}}, 'execution_count': 1}}, "
        "parent=ip.kernel.get_parent())\n"
        "    return 1000.0\n"
    ),
    "messages for earlier cells": (
        "seen = []\n"
        "\n"
        "def {answer}(case):\n"
        "    ip = get_ipython()\n"
        "    seen.append(ip.kernel.get_parent())\n"
        "    for parent in seen:\n"
        "        for kind in ('update_display_data', 'execute_result', 'display_data'):\n"
        "            ip.kernel.session.send(ip.kernel.iopub_socket, kind, {{'data': "
        "{{'text/plain': '3'}}, 'metadata': {{}}, 'transient': {{'display_id': 'x'}}, "
        "'execution_count': 1}}, parent=parent)\n"
        "    return 1000.0\n"
    ),
    "idle before its time": (
        "def {answer}(case):\n"
        "    ip = get_ipython()\n"
        "    ip.kernel.session.send(ip.kernel.iopub_socket, 'status', "
        "{{'execution_state': 'idle'}}, parent=ip.kernel.get_parent())\n"
        "    return 1000.0\n"
    ),
    "a widget that captures outputs": (
        "from comm import create_comm\n"
        "\n"
        "create_comm(target_name='jupyter.widget', data={{'state': {{'_model_name': "
        "'OutputModel', '_model_module': '@jupyter-widgets/output', 'outputs': [], "
        "'msg_id': ''}}, 'buffer_paths': []}}, metadata={{'version': '2.0'}})\n"
        "\n"
    )
    + WRONG,
    "malformed outputs": (
        "ip = get_ipython()\n"
        "for kind, content in (('stream', {{'name': 'stdout', 'text': ['x']}}), "
        "('display_data', {{'data': 3, 'metadata': {{}}}}), ('error', {{'ename': 1, "
        "'evalue': {{}}, 'traceback': 3}}), ('execute_result', {{'data': {{'text/plain': "
        "{{}}}}, 'metadata': 3, 'execution_count': 'x'}}), ('clear_output', {{'wait': "
        "'x'}}), ('shutdown_reply', {{}}), ('stream', {{}})):\n"
        "    ip.kernel.session.send(ip.kernel.iopub_socket, kind, content, "
        "parent=ip.kernel.get_parent())\n"
        "\n"
    )
    + WRONG,
    "tell replaced": (
        "import sys\n"
        "\n"
        "sys.modules['nrdob_course.encoding'].tell = lambda *any: "
        "get_ipython().display_pub.publish({{'application/vnd.nrdob.answer+json': "
        '\'{{"value": {{"other": ["Points", "3"]}}}}\'}})\n'
        "\n"
    )
    + WRONG,
    "a deep answer": (
        "def {answer}(case):\n    x = []\n    for _ in range(900):\n        x = [x]\n    return x\n"
    ),
    "a deep text": (
        "import sys\n"
        "\n"
        "sys.modules['nrdob_course.encoding'].tell = lambda *any: "
        "get_ipython().display_pub.publish({{'application/vnd.nrdob.answer+json': '[' * "
        "900_000}})\n"
        "\n"
    )
    + WRONG,
    "nine thousand coefficients": (
        "import control\n"
        "\n"
        "def {answer}(case):\n"
        "    import numpy\n"
        "    return control.tf(numpy.ones(9000), numpy.ones(9001))\n"
    ),
    "a filter of order a million": (
        "import sys\n"
        "\n"
        "sys.modules['nrdob_course.encoding'].encode = lambda value: {{'filter': "
        "[1.0, 10**6]}}\n"
        "\n"
    )
    + WRONG,
    "an empty array of a huge shape": (
        "import sys\n"
        "\n"
        "sys.modules['nrdob_course.encoding'].encode = lambda value: {{'array': [], "
        "'shape': [0, 10**12]}}\n"
        "\n"
    )
    + WRONG,
    "a thousand loops": (
        "import sys\n"
        "\n"
        "sys.modules['nrdob_course.encoding'].encode = lambda value: {{'list': "
        "[{{'loop': [1, 1, 1, {{'filter': [1.0, 50]}}]}}] * 1000}}\n"
        "\n"
    )
    + WRONG,
    "infinite and no numbers": (
        "import control\n"
        "\n"
        "def {answer}(case):\n"
        "    system = control.tf([1], [1, 1])\n"
        "    system.num[0][0][:] = float('nan')\n"
        "    return system\n"
    ),
    "a group that changes": (
        "class Group(int):\n"
        "    calls = 0\n"
        "    def __str__(self):\n"
        "        Group.calls += 1\n"
        "        return str(Group.calls)\n"
        "    __repr__ = __str__\n"
        "\n"
        "GROUP = Group(5)\n"
        "\n"
    )
    + WRONG,
    "a group of a megabyte": ("GROUP = '5' * 1_000_000\n\n") + WRONG,
    "another case": (
        "import nrdob_course.exercises as graders\n\ngraders.own_case = lambda *any: 1\n\n"
    )
    + WRONG,
    "a page of thirty megabytes": (
        "from IPython.display import HTML, display\n\ndisplay(HTML('x' * 30_000_000))\n\n"
    )
    + WRONG,
    "a name that is markup": (
        "class Ä(float):\n"
        "    pass\n"
        "\n"
        "Ä.__name__ = '<script>alert(1)</script>'\n"
        "\n"
        "def {answer}(case):\n"
        "    raise type('<script>', (Exception,), {{}})('<img src=x onerror=alert(1)>')\n"
    ),
    "the graders imported": (
        "import importlib\n"
        "\n"
        "set2 = importlib.import_module('nrdob_course.exercises.set2')\n"
        "{answer} = set2.TURNS.misconceptions[0].example\n"
    ),
    "the finder taken away": (
        "import sys\n"
        "\n"
        "for name in [name for name in sys.modules if name.startswith('nrdob_course')]:\n"
        "    del sys.modules[name]\n"
        "sys.meta_path.pop(0)\n"
        "from nrdob_course.exercises import PROBLEMS\n"
        "\n"
    )
    + WRONG,
    "graders in memory": (
        "import gc\n"
        "\n"
        "found = [each for each in gc.get_objects() if type(each).__name__ == 'Problem']\n"
        "if not found:\n"
        "    raise LookupError('none')\n"
        "\n"
    )
    + WRONG,
    "the handout read again": ("found = open('handout.json').read()\n\n") + WRONG,
    "deep folders": ("import os\n\nfor _ in range(1500):\n    os.mkdir('d')\n    os.chdir('d')\n\n")
    + WRONG,
    "twenty large files": (
        "for k in range(20):\n"
        "    with open(f'f{{k}}', 'wb') as file:\n"
        "        for _ in range(19):\n"
        "            file.write(bytes(1 << 20))\n"
        "\n"
    )
    + WRONG,
    "deleted files": (
        "import os\n"
        "\n"
        "held = []\n"
        "for k in range(20):\n"
        "    held.append(open(f'f{{k}}', 'wb'))\n"
        "    os.remove(f'f{{k}}')\n"
        "    for _ in range(19):\n"
        "        held[-1].write(bytes(1 << 20))\n"
        "    held[-1].flush()\n"
        "import time\n"
        "time.sleep(2)\n"
        "\n"
    )
    + WRONG,
    "sixty daemons": (
        "import subprocess\n\nfor _ in range(60):\n    subprocess.Popen(['sleep', '1000'])\n\n"
    )
    + WRONG,
    "five times four hundred megabytes": ("kept = [bytes(400 << 20) for _ in range(5)]\n\n")
    + WRONG,
    "a reply with a payload": (
        "get_ipython().payload_manager.write_payload({{'source': 'set_next_input', "
        "'text': 'score = 3', 'replace': True}})\n"
        "\n"
    )
    + WRONG,
    "a number of a cell that is none": (
        "import json\n"
        "\n"
        "kernel = get_ipython().kernel\n"
        "kernel.session.pack = lambda content: json.dumps(content, default=str).encode()\n"
        "kernel.session.send(kernel.iopub_socket, 'execute_result', {{'data': {{'text/plain': "
        "'3'}}, 'metadata': {{}}, 'execution_count': '\\ud800'}}, parent=kernel.get_parent())\n"
        "\n"
    )
    + WRONG,
    "hooks after each cell": (
        "get_ipython().events.register('post_run_cell', lambda result: print('3'))\n\n"
    )
    + WRONG,
    "a transformer of cells": (
        "get_ipython().input_transformers_cleanup.append(lambda lines: ['3'])\n\n"
    )
    + WRONG,
    "the kernel's key": (
        "import glob\n"
        "\n"
        "found = open(glob.glob('*.json')[0]).read()\n"
        "raise ValueError(len(found))\n"
        "\n"
    )
    + WRONG,
}
"""Cells that answer wrongly and want the points all the same; `answer` is the name asked for."""

LATER = """from IPython.display import update_display

for name in ("x", "y"):
    shown = {"text/plain": "3", "text/html": "<p>3 of 3 points</p>"}
    update_display(shown, raw=True, display_id=name)
"""
"""A cell after all others, which shows two displays again."""

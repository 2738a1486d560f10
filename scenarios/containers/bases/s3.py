"""An S3-compatible store with one bucket: moto's server, on the port that compose names."""

import boto3
from moto.server import ThreadedMotoServer

server = ThreadedMotoServer(ip_address="0.0.0.0", port=9000, verbose=False)
server.start()
boto3.client(
    "s3",
    endpoint_url="http://127.0.0.1:9000",
    region_name="us-east-1",
    aws_access_key_id="x",
    aws_secret_access_key="x",
).create_bucket(Bucket="buildarena")
server._thread.join()
